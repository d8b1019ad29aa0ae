# Empty dependencies file for knead.
# This may be replaced when dependencies are built.
