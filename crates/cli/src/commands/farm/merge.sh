# Merges the parts: of the frame that the argument gives, if there are frames.

set -u
# FRAME
cd "$from" || exit 3
files=()
for ((i = 1; i <= parts; i++)); do
  files+=("$folder/$named$i.part")
done
"$lumiris" merge "${options[@]}" "${frame[@]}" -- "${files[@]}" || exit
# So that a frame need not be merged again
[ -z "$image" ] || : >"$folder/${image}merged"
