#include "clients/knead/sweep_runs.h"
