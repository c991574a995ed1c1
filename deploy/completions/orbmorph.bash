# Completions of orbmorph for bash, printed by 'orbmorph completions bash'.
_orbmorph() {
  local current="${COMP_WORDS[COMP_CWORD]}" previous="${COMP_WORDS[COMP_CWORD-1]}" words="" operands="" choices=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "morph upload embed merge job ls get rm usage doctor view sign studio completions --help --version" -- "$current"))
    return
  fi
  case "$previous" in
    --align) choices="pin rbf rotate auto" ;;
    --remesh) choices="adaptive overlay subdivision convex-hull template" ;;
    --animation) choices="pingpong none" ;;
    --fit) choices="auto none rigid similarity" ;;
    --path) choices="linear rigid" ;;
    --repair) choices="safe none fill_holes largest_component split_nonmanifold close_handles" ;;
    --format) choices="obj off ply stl 3mf gltf glb" ;;
    --method) choices="newton kernel-sampling" ;;
    --preset) choices="fast default quality" ;;
    --state) choices="queued running succeeded failed cancelled" ;;
    --part) choices="file asset sphere" ;;
    --up) choices="auto y z x -y -z -x" ;;
    --profile) choices="float quantized meshopt" ;;
  esac
  if [ -n "$choices" ]; then
    COMPREPLY=($(compgen -W "$choices" -- "$current"))
    return
  fi
  case "${COMP_WORDS[1]}" in
    morph)
      words="--server --json --quiet --help --output --report --landmarks --align --remesh --tolerance --max-triangles --no-normals --animation --fit --path --transfer --set --no-wait --repair --handle-size --take-part --profile "
      ;;
    upload)
      words="--server --json --quiet --help --name --repair --handle-size --take-part --format "
      ;;
    embed)
      words="--server --json --quiet --help --output --set --no-wait --repair --handle-size --take-part --method --preset "
      ;;
    merge)
      words="--server --json --quiet --help --output --report --landmarks --align --remesh --tolerance --max-triangles --no-normals --animation --fit --path --transfer --set --no-wait --repair --handle-size --take-part --profile "
      ;;
    job)
      words="--server --json --quiet --help --wait --cancel "
      ;;
    ls)
      words="--server --json --quiet --help --state --limit "
      operands="meshes embeddings supermeshes jobs"
      ;;
    get)
      words="--server --json --quiet --help --output --part --profile "
      ;;
    rm)
      words="--server --json --quiet --help "
      ;;
    usage)
      words="--server --json --quiet --help --limit "
      ;;
    doctor)
      words="--server --json --quiet --help "
      ;;
    view)
      words="--quiet --help --output --poses --size --up --yaw --pitch --wire --inside --frames "
      ;;
    sign)
      words="--help --key --expires "
      ;;
    studio)
      words="--quiet --help --repair --handle-size --take-part --data --no-open "
      ;;
    completions)
      words="--help "
      operands="bash zsh fish"
      ;;
  esac
  case "$current" in
    -*) COMPREPLY=($(compgen -W "$words" -- "$current")) ;;
    *) COMPREPLY=($(compgen -W "$operands" -- "$current")) ;;
  esac
}
complete -o bashdefault -o default -F _orbmorph orbmorph
