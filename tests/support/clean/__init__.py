"""Records in which nothing is hidden, drawn with code that neither the models nor the diagnosis share."""
