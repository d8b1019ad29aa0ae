file(REMOVE_RECURSE
  "CMakeFiles/tool_sniff.dir/e2e/tool_sniff.c.o"
  "CMakeFiles/tool_sniff.dir/e2e/tool_sniff.c.o.d"
  "tools/sniff"
  "tools/sniff.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/tool_sniff.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
