# CMake generated Testfile for 
# Source directory: /tmp/wt/scripts/server
# Build directory: /tmp/wt/scripts/server
# 
# This file includes the relevant testing commands required for 
# testing this directory and lists subdirectories to be tested as well.
