#include "clients/knead/stability_trial.h"
