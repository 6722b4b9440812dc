"""Release folder: FMUs and systems for all platforms, with a manifest of digests."""
