#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# A task of a render farm (Deadline, OpenCue, Flamenco, Tractor, ...) that runs a Blender program.
#
#   render_farm.sh TASK TASKS scene.blend DIR [options of radarsim render]
#
# Submit it as a command-line job with as many "frames" as tasks, one frame a task: TASK is the farm's
# number of the frame (<STARTFRAME> in Deadline, #IFRAME# in OpenCue), from 1. DIR may be one folder
# for all, on a disk that they share, or "part_TASK": then radarsim merge DIR part_* makes one run.
# BLENDER and RADARSIM name the program and the folder of radarsim on the farm.
set -eu
task=$1
tasks=$2
scene=$3
folder=$4
shift 4
export OMP_NUM_THREADS="${OMP_NUM_THREADS:-1}"
exec "${BLENDER:-blender}" -b "$scene" -P "${RADARSIM:-.}/scripts/render_radar.py" -- \
    --out "$folder" "$@" --shard "$task/$tasks"
