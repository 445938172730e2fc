# Submits the jobs: a plan, where one is needed; an array job with a task for every part; and a job that merges. Parts that
# are complete are not rendered again, so this may be run again after a failure.

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

# submit WHAT OPTION…: the folder is the job's, so that its name needs no quoting in the names of logs
submit() {
  what=$1
  shift
  id=$(sbatch --parsable --job-name="lumiris-$what" --chdir="$folder" --open-mode=append --nodes=1 --ntasks=1 --requeue \
    "$@" "$folder/$what.sh")
  id=${id%%;*}
  [[ $id =~ ^[0-9]+$ ]] || { echo "sbatch printed \`$id\`, which is no job id" >&2; false; }
  submitted+=("$id")
  echo "$what: job $id"
}

after=()
if [ -n "$needs_plan" ] && ! [ -e "$folder/plan.json" ]; then
  submit plan --output=plan.log "${options[@]}"
  after=(--dependency="afterok:$id" --kill-on-invalid-dep=yes)
fi
submit part --output=%a.log --array="1-$parts" --signal=B:USR1@60 "${after[@]}" "${options[@]}"
submit merge --output=merge.log --dependency="afterok:$id" --kill-on-invalid-dep=yes "${options[@]}"
(IFS=,; echo "${submitted[*]}") >"$folder/jobs"
