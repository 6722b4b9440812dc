"""How things are shown: on the terminal, as pictures, as interactive plots, on a page."""
