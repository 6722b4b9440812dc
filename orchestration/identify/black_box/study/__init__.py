"""Black-box models of a record: read, search, told, drawn, and written as a component."""
