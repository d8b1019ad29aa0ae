# Empty dependencies file for test_core_contact.
# This may be replaced when dependencies are built.
