// SPDX-License-Identifier: BSD-3-Clause
// On which scene a recording is replayed: the one that it was made on, or none. Main
// thread, before anything starts.
#ifndef GLOVED_DAEMON_REPLAY_H
#define GLOVED_DAEMON_REPLAY_H

#include "daemon/load/about.h"
#include "daemon/load/config_load.h"

// For --fcu trace:FILE with a FILE.about beside it. Where the user chose no scene: the recorded one, from
// its own place (settings->scene is set), or, where that has changed or gone, from the text that was kept
// (*out_text, in `recorded`). Where he chose one with other contents, or the recorded one is nowhere:
// negative, with both names in err. *out_warning: settings that differ from the recording's, else empty.
// Nothing for other URLs, or without that file.
int gv_replay_scene(gv_settings *settings, bool scene_chosen, gv_about *recorded, const char **out_text,
                    char out_warning[300], char *err, size_t err_size);

#endif
