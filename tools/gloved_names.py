# SPDX-License-Identifier: BSD-3-Clause
"""Fingers, sensors and states of the safety machine in the order of the LCM types and of the C enumerations (test_fcu.py
compares): said here once for everything in Python."""
FINGERS = ("thumb", "index", "middle", "ring", "little")
SENSORS = ("thumb_rotate", "thumb_mpj", "thumb_ij", "thumb_abduction", "index_mpj", "index_pij", "index_dij", "middle_mpj",
           "middle_pij", "middle_dij", "middle_index_abduction", "ring_mpj", "ring_pij", "ring_dij", "ring_middle_abduction",
           "little_mpj", "little_pij", "little_dij", "little_ring_abduction", "palm_arch", "wrist_pitch", "wrist_yaw")
SAFETY = ("start", "wait", "ready", "armed", "active", "fault", "stopped")
