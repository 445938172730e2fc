# Measures what the settings leave open, once for all parts and frames, on a machine like those that render them.

set -u
cd "$from" || exit 3
if [ -e "$folder/plan.json" ]; then
  echo "the plan is made already"
  exit 0
fi
threads=()
if [ -z "$has_threads" ] && [ -n "${SLURM_CPUS_ON_NODE:-}" ]; then
  threads=(--threads "$SLURM_CPUS_ON_NODE")
fi
exec "$lumiris" plan "${options[@]}" "${threads[@]}" -o "$folder/plan.json" -- "$first_scene"
