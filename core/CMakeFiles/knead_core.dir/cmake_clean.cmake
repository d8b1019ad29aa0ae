file(REMOVE_RECURSE
  "CMakeFiles/knead_core.dir/contact.c.o"
  "CMakeFiles/knead_core.dir/contact.c.o.d"
  "CMakeFiles/knead_core.dir/grid.c.o"
  "CMakeFiles/knead_core.dir/grid.c.o.d"
  "CMakeFiles/knead_core.dir/hash.c.o"
  "CMakeFiles/knead_core.dir/hash.c.o.d"
  "CMakeFiles/knead_core.dir/law.c.o"
  "CMakeFiles/knead_core.dir/law.c.o.d"
  "CMakeFiles/knead_core.dir/material.c.o"
  "CMakeFiles/knead_core.dir/material.c.o.d"
  "CMakeFiles/knead_core.dir/model.c.o"
  "CMakeFiles/knead_core.dir/model.c.o.d"
  "CMakeFiles/knead_core.dir/safety.c.o"
  "CMakeFiles/knead_core.dir/safety.c.o.d"
  "CMakeFiles/knead_core.dir/solver_implicit.c.o"
  "CMakeFiles/knead_core.dir/solver_implicit.c.o.d"
  "CMakeFiles/knead_core.dir/solver_rk4.c.o"
  "CMakeFiles/knead_core.dir/solver_rk4.c.o.d"
  "CMakeFiles/knead_core.dir/state.c.o"
  "CMakeFiles/knead_core.dir/state.c.o.d"
  "CMakeFiles/knead_core.dir/step.c.o"
  "CMakeFiles/knead_core.dir/step.c.o.d"
  "CMakeFiles/knead_core.dir/surface.c.o"
  "CMakeFiles/knead_core.dir/surface.c.o.d"
  "libknead.a"
  "libknead.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/knead_core.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
