# Renders one part: of the number that Slurm gives the task, or that of the last argument (for other queues).

set -u
# FRAME
# The only part needs no number
[ "$parts" -ne 1 ] || : "${SLURM_ARRAY_TASK_ID:=1}"
i=${1:-${SLURM_ARRAY_TASK_ID:?which part? Give its number}}
cd "$from" || exit 3
if ! [ "$i" -ge 1 ] 2>/dev/null || ! [ "$i" -le "$parts" ]; then
  echo "there is no part $i of $parts$of" >&2
  exit 2
fi
if [ -e "$folder/$image$i.part" ]; then
  echo "part $i of $parts$of is complete"
  exit 0
fi

# As many threads as Slurm gives the task; without task plugins, nothing else keeps it to its processors
threads=()
if [ -z "$has_threads" ] && [ -n "${SLURM_CPUS_ON_NODE:-}" ]; then
  threads=(--threads "$SLURM_CPUS_ON_NODE")
fi

# When a job is cancelled, requeued or preempted, Slurm sends SIGTERM to all of its processes, so also to the renderer,
# which stores a checkpoint; a second SIGTERM would end it at once, so it is not passed on. SIGUSR1 is for this shell alone:
# the time limit is near.
child= interrupted=1 is_late=
trap 'interrupted=1' TERM
trap 'interrupted=1 is_late=1; [ -z "$child" ] || kill -TERM "$child"' USR1

"$lumiris" render "${options[@]}" "${threads[@]}" "${frame[@]}" --part "$i/$parts" \
  --checkpoint "$folder/$named$i.film,$seconds" --resume "$folder/$named$i.film" \
  -o "$folder/$named$i.unfinished.part" -q -- "$scene" &
child=$!
[ -z "$is_late" ] || kill -TERM "$child"

# A signal ends `wait`, but not the renderer; 127 says that its exit code was there before the signal
code=127
while [ -n "$interrupted" ]; do
  interrupted=
  wait "$child"
  now=$?
  [ "$now" -eq 127 ] || code=$now
done

if [ "$code" -eq 0 ]; then
  # Only what is complete has the name of a part. A node that seemed lost may have rendered it meanwhile: the same bits
  mv "$folder/$image$i.unfinished.part" "$folder/$image$i.part" || [ -e "$folder/$image$i.part" ] || exit 3
  rm -f "$folder/$image$i.film"
  echo "part $i of $parts$of is rendered"
  exit 0
fi
rm -f "$folder/$image$i.unfinished.part"
if [ -n "$is_late" ] && [ -n "${SLURM_JOB_ID:-}" ] && [ -e "$folder/$image$i.film" ]; then
  echo "the time limit is near: part $i of $parts$of goes back to the queue"
  scontrol requeue "$SLURM_JOB_ID"
fi
exit "$code"
