"""Records in which something is hidden, by equations that share nothing with the catalogue of effects."""
