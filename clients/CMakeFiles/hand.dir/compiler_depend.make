# Empty compiler generated dependencies file for hand.
# This may be replaced when dependencies are built.
