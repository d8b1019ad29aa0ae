#!/usr/bin/env bash
# A newcomer who has only what is installed: each public header compiles by itself in C and in C++; the same press in C and
# C++ gives the same lines; a foreign project finds both libraries by CMake and by pkg-config, shared and
# static.
set -eu
prefix=$PWD/prefix
cmake --install "$KN_BUILD" --prefix "$prefix" >install.log
library=$(dirname "$(find "$prefix" -name libknead.so)")
export PKG_CONFIG_PATH=$library/pkgconfig LD_LIBRARY_PATH=$library
warnings=(-Wall -Wextra -pedantic -Werror)
read -ra flags <<<"$(pkg-config --cflags --libs knead)"
read -ra scene_flags <<<"$(pkg-config --cflags --libs knead-scene)"

headers=$(cd "$prefix/include" && find knead -name '*.h')
for header in $headers; do
    echo "#include <$header>" >alone.c
    cc -std=c17 "${warnings[@]}" -I "$prefix/include" -fsyntax-only alone.c
    c++ -x c++ -std=c++17 "${warnings[@]}" -I "$prefix/include" -fsyntax-only alone.c
done
echo "ok   $(echo "$headers" | wc -l) headers compile by themselves in C and in C++"

cp "$prefix"/share/knead/clients/examples/press* .
cc "${warnings[@]}" -o press press.c "${flags[@]}"
c++ "${warnings[@]}" -x c++ -o press_cpp press.c -x none "${flags[@]}"
./press >press.out
./press_cpp | cmp - press.out
[ "$(wc -l <press.out)" = 31 ] && grep -q '^hash [0-9a-f]\{16\}$' press.out
echo "ok   C and C++ print the same 31 lines: $(tail -n 1 press.out)"

cat >scene.c <<'C'
#include <knead/knead.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    char error[300];
    kn_scene *scene = kn_scene_load(argv[argc - 1], NULL, 0, error, sizeof error);
    if (!scene) return fprintf(stderr, "%s\n", error), 2;
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    kn_state *state = model ? kn_state_create(model) : NULL;
    kn_scratch *scratch = model ? kn_scratch_create(model) : NULL;
    if (!state || !scratch) return fprintf(stderr, "%s\n", error), 1;
    kn_input in = {.top_load_n = 0.5, .probe[3].attached = true}; // the scene has fewer tools
    kn_output out;
    if (kn_step(model, state, scratch, &in, &out) != KN_BAD_INPUT) return 1;
    in.probe[3].attached = false;
    for (int i = 0; i < 100; i++)
        if (kn_step(model, state, scratch, &in, &out) != KN_OK) return 1;
    printf("%s %s: %d nodes, hash %llx\n", kn_version(), KN_VERSION, model->node_count,
           (unsigned long long)kn_state_hash(model, state));
    kn_scratch_destroy(scratch);
    kn_state_destroy(state);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
}
C
cat >CMakeLists.txt <<'CMAKE'
cmake_minimum_required(VERSION 3.25)
project(stranger C)
find_package(knead 0.10 REQUIRED)
add_executable(shared scene.c)
target_link_libraries(shared PRIVATE knead::knead-scene)
add_executable(static scene.c)
target_link_libraries(static PRIVATE knead::knead-scene-static)
CMAKE
cmake -B build -S . -DCMAKE_PREFIX_PATH="$prefix" >cmake.log
cmake --build build >>cmake.log
scene=$prefix/share/knead/scenes/dough.yaml
./build/shared "$scene" | tee scene.out
./build/static "$scene" | cmp - scene.out
cc -std=c17 -o by_pkg_config scene.c "${scene_flags[@]}"
./by_pkg_config "$scene" | cmp - scene.out
cc -std=c17 -o by_archive scene.c -I "$prefix/include" "$library/libknead-scene.a" "$library/libknead.a" -lyaml -lm
./by_archive "$scene" | cmp - scene.out
code=0 && ./build/shared missing.yaml 2>error.out || code=$?
[ $code = 2 ] && grep -q '^missing.yaml' error.out
echo "ok   a scene by CMake and pkg-config, shared and static"

"$prefix/bin/knead" --version >/dev/null
