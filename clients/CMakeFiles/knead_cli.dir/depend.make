# Empty dependencies file for knead_cli.
# This may be replaced when dependencies are built.
