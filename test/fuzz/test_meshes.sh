#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Damaged meshes, in the virtual environment that the scene compiler makes for itself.
exec tools/mesh/python test/fuzz/mutate_meshes.py
