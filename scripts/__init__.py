"""What users and developers of pgfmd run. Studies are run from the root of the repository, `python -m scripts.studies...`."""
