"""What makes the figures and tables of docs/, a folder a study; README.md beside this file lists them."""
