file(REMOVE_RECURSE
  "../bin/knead"
  "../bin/knead.pdb"
  "CMakeFiles/knead.dir/knead/main.c.o"
  "CMakeFiles/knead.dir/knead/main.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
