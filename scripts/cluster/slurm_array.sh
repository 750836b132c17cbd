#!/bin/sh
# SPDX-License-Identifier: GPL-3.0-or-later
# A radar run as a SLURM array: each task does every n-th frame, all into one folder on a shared disk.
#
#   radarsim render scene.blend --out /shared/run --frames 1:1000 --plan-only
#   sbatch --array=1-64 scripts/cluster/slurm_array.sh scene.blend /shared/run --frames 1:1000
#
# A task that fails is given again alone (sbatch --array=17 ...) and resumes. When all have ended:
# radarsim info /shared/run says whether a frame is missing.
#SBATCH --job-name=radarsim
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
set -eu
scene=$1
run=$2
shift 2
export OMP_NUM_THREADS="${SLURM_CPUS_PER_TASK:-1}"
# The array's own size, also for a part of it that is given again: set TASKS to it then.
exec radarsim render "$scene" --out "$run" "$@" --process \
    --shard "$SLURM_ARRAY_TASK_ID/${TASKS:-$SLURM_ARRAY_TASK_COUNT}"
