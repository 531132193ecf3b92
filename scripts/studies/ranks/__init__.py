"""How much faster more ranks are, and where their time goes."""
