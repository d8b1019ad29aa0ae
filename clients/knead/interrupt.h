#include "clients/knead/command.h"
