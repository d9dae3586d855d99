#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The scene compiler, in the virtual environment that it makes for itself.
exec tools/mesh/python test/system/compiler.py
