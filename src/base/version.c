// SPDX-License-Identifier: BSD-3-Clause
// The version as the Makefile states it, and the commit that it was built from. Any thread.
#include "gloved/version.h"

#include "version.h"

const char *gv_version(void) { return GLOVED_VERSION; }
const char *gv_commit(void) { return GLOVED_COMMIT; }
const char *gv_version_text(void) { return GLOVED_VERSION " (" GLOVED_COMMIT ")"; }
