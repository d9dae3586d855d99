// SPDX-License-Identifier: BSD-3-Clause
// Which gloved this is. Strings live for ever; any thread.
#ifndef GLOVED_VERSION_H
#define GLOVED_VERSION_H

#ifdef __cplusplus
extern "C" {
#endif

const char *gv_version(void);  // "0.1.0"
// short hash of the commit, with + where the tree had changes, or "unknown"
const char *gv_commit(void);
const char *gv_version_text(void);  // "0.1.0 (1a2b3c4)"

#ifdef __cplusplus
}
#endif

#endif
