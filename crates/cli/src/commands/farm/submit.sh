# Submits the jobs: an array job with a task for every part, and a job that merges, for every frame that is not merged yet if
# there are frames. Parts that are complete are not rendered again, so this may be run again after a failure.

set -Eeu
for program in sbatch squeue scancel; do
  if ! command -v "$program" >/dev/null; then
    echo "there is no $program in \$PATH: this is no machine of a Slurm cluster" >&2
    exit 3
  fi
done
if [ -s "$folder/jobs" ] && squeue --noheader --jobs="$(cat "$folder/jobs")" 2>/dev/null | grep -q .; then
  echo "jobs $(cat "$folder/jobs") are in the queue already; \`scancel\` removes them" >&2
  exit 3
fi

# All or none
submitted=()
cancel() {
  code=$?
  [ "${#submitted[@]}" -eq 0 ] || scancel "${submitted[@]}"
  exit "$code"
}
trap cancel ERR

# submit WHAT FRAME OPTION…: the folder is the job's, so that its name needs no quoting in the names of logs
submit() {
  what=$1 n=$2
  shift 2
  name=lumiris-$what${n:+-$n}
  id=$(sbatch --parsable --job-name="$name" --chdir="$folder" --open-mode=append --nodes=1 --ntasks=1 --requeue \
    "$@" "$folder/$what.sh" ${n:+"$n"})
  id=${id%%;*}
  [[ $id =~ ^[0-9]+$ ]] || { echo "sbatch printed \`$id\`, which is no job id" >&2; false; }
  submitted+=("$id")
  echo "$what${n:+ of frame $n}: job $id"
}

# image FRAME PREFIX: the parts of an image, and their merge; the prefix is that of the names of its files
image() {
  submit part "$1" --output="$2%a.log" --array="1-$parts" --signal=B:USR1@60 "${options[@]}"
  submit merge "$1" --output="$2merge.log" --dependency="afterok:$id" --kill-on-invalid-dep=yes "${options[@]}"
}

[ "${#frames[@]}" -gt 0 ] || image '' ''
for frame in "${frames[@]}"; do
  printf -v prefix '%04d.' "$frame"
  if [ -e "$folder/${prefix}merged" ]; then
    echo "frame $frame is merged"
  else
    image "$frame" "$prefix"
  fi
done
[ "${#submitted[@]}" -eq 0 ] || (IFS=,; echo "${submitted[*]}") >"$folder/jobs"
