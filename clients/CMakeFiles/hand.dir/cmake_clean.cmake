file(REMOVE_RECURSE
  "../bin/hand"
  "../bin/hand.pdb"
  "CMakeFiles/hand.dir/examples/hand.c.o"
  "CMakeFiles/hand.dir/examples/hand.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/hand.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
