# Empty dependencies file for tool_send.
# This may be replaced when dependencies are built.
