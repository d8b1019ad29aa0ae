file(REMOVE_RECURSE
  "../bin/kneadd"
  "../bin/kneadd.pdb"
  "CMakeFiles/kneadd.dir/kneadd.c.o"
  "CMakeFiles/kneadd.dir/kneadd.c.o.d"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/kneadd.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
