# Merges the parts.

set -u
cd "$from" || exit 3
files=()
for ((i = 1; i <= parts; i++)); do
  files+=("$folder/$i.part")
done
exec "$lumiris" merge "${options[@]}" -- "${files[@]}"
