# With frames, the first argument is the number of one. `image` is how the files of the image are called, `of` what is called
# so in messages, and `named` what the renderer, which knows frames itself, puts in place of ####
frame=() image= of= named=
if [ "${#frames[@]}" -gt 0 ]; then
  n=${1:?which frame? Give its number}
  shift
  if [[ " ${frames[*]} " != *" $n "* ]]; then
    echo "there is no frame $n" >&2
    exit 2
  fi
  printf -v image '%04d.' "$n"
  frame=(--frames "$n") of=" of frame $n" named='####.'
fi
