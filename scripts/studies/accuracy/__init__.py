"""What the grid makes of simple contacts, and how well a run knows its own errors."""
