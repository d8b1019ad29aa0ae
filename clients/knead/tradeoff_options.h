#include "clients/knead/plan.h"
