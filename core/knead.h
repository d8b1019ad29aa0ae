#ifndef KN_CORE_KNEAD_H
#define KN_CORE_KNEAD_H
// libknead in one header, for a program with its own loop (clients/examples). The functions of scene.h are in
// libknead-scene, all others in libknead. All numbers are in SI units, angles in radians. No function aborts, prints or
// reads a clock; only the functions that say so allocate memory.
#include "core/contact_fit.h"
#include "core/device.h"
#include "core/ensemble.h"
#include "core/field.h"
#include "core/hash.h"
#include "core/lattice/measure.h"
#include "core/level_plate.h"
#include "core/network.h"
#include "core/oneport.h"
#include "core/passivity.h"
#include "core/safety.h"
#include "core/scene/scene.h"
#include "core/shape.h"
#include "core/snapshot.h"
#include "core/step.h"
#include "core/surface.h"
#include "core/touch.h"

// Version of these headers; kn_version (step.h) returns that of the library that runs. While MAJOR is 0, a program
// needs the library of the MAJOR.MINOR that it was compiled for, as the soname says.
#ifndef KN_VERSION
#define KN_VERSION "@PROJECT_VERSION@"
#endif

#endif
