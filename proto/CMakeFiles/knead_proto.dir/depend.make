# Empty dependencies file for knead_proto.
# This may be replaced when dependencies are built.
