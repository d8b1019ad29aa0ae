#include "clients/knead/paraview.h"
