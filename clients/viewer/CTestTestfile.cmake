# CMake generated Testfile for 
# Source directory: /tmp/wt/scripts/clients/viewer
# Build directory: /tmp/wt/scripts/clients/viewer
# 
# This file includes the relevant testing commands required for 
# testing this directory and lists subdirectories to be tested as well.
