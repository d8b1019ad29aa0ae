# CMake generated Testfile for 
# Source directory: /tmp/wt/scripts/core
# Build directory: /tmp/wt/scripts/core
# 
# This file includes the relevant testing commands required for 
# testing this directory and lists subdirectories to be tested as well.
subdirs("scene")
