"""What a sweep leaves on disk: while it runs, and when it is done."""
