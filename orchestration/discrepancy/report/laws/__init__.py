"""What a model's laws lack: in words, as figures, as a page, and as a class to go on with."""
