"""The commands of the command line: their options, and what each prints. Each loads what it needs when it starts."""
