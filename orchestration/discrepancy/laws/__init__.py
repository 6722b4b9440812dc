"""What the laws of a model lack: which law, of which signal, and the curve."""
