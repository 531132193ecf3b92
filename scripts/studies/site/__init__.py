"""What makes the pictures of the gallery, and the picture and the movie of the first page."""
