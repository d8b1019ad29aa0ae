# Empty compiler generated dependencies file for test_server_mailbox.
# This may be replaced when dependencies are built.
