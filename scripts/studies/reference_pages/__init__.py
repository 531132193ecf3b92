"""Tables of docs/reference that are made from declarations in the code."""
