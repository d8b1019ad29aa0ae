#!/usr/bin/env bash
# A foreign program finds libknead through its CMake package and through pkg-config, links it and steps a block.
set -eu
prefix=$PWD/prefix
cmake --install "$KN_BUILD" --prefix "$prefix" >install.log

cat >press.c <<'C'
#include "core/step.h"
#include <stdio.h>

int main(void)
{
    char error[200];
    kn_model_def def = kn_model_def_default();
    kn_model *model = kn_model_build(&def, error, sizeof error);
    if (!model) return fprintf(stderr, "%s\n", error), 1;
    kn_state *state = kn_state_create(model);
    kn_scratch *scratch = kn_scratch_create(model);
    kn_input input = {.top_load_n = 0.5};
    kn_output output;
    for (int i = 0; i < 100; i++)
        if (kn_step(model, state, scratch, &input, &output) != KN_OK) return 1;
    double top_m[3];
    kn_state_position(model, state, model->grid.nodes - 1, top_m);
    printf("height after 0.1 s under 0.5 N: %.6f m\n", top_m[2]);
    return !(top_m[2] < 0.03 && top_m[2] > 0.02);
}
C
cat >CMakeLists.txt <<'CMAKE'
cmake_minimum_required(VERSION 3.25)
project(stranger C)
find_package(knead 0.1 REQUIRED)
add_executable(press press.c)
target_link_libraries(press PRIVATE knead::knead)
CMAKE
cmake -B build -S . -DCMAKE_PREFIX_PATH="$prefix" >cmake.log
cmake --build build >>cmake.log
./build/press | tee cmake.out

pc=$(find "$prefix" -name knead.pc)
export PKG_CONFIG_PATH=${pc%/*}
# shellcheck disable=SC2046  # pkg-config prints words
cc -std=c17 -o press press.c $(pkg-config --cflags --libs knead)
./press | cmp - cmake.out

"$prefix/bin/knead" --version >/dev/null
test -f "$prefix/share/knead/scenes/dough.yaml"
