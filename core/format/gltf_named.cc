#include "format/gltf_named.hh"

namespace gltf {

namespace {

/* Marks the meshes of a node and of all below it. seen: the nodes that are done, each of which is visited once. */
void mark_below(const List &nodes, size_t root, std::vector<bool> *seen, std::vector<bool> *named) {
  std::vector<size_t> stack{root};
  while (!stack.empty()) {
    size_t at = stack.back();
    stack.pop_back();
    if ((*seen)[at]) {
      continue;
    }
    (*seen)[at] = true;
    int64_t mesh = whole(nodes[at], "mesh", NONE);
    if (mesh >= 0 && mesh < static_cast<int64_t>(named->size())) {
      (*named)[static_cast<size_t>(mesh)] = true;
    }
    for (const cJSON *child : array_of(nodes[at], "children")) {
      double index = cJSON_IsNumber(child) ? child->valuedouble : -1;
      if (index >= 0 && index < static_cast<double>(nodes.size())) {
        stack.push_back(static_cast<size_t>(index));
      }
    }
  }
}

}  // namespace

std::vector<bool> named_meshes(const cJSON *doc, size_t mesh_count, const orb_document_parts &parts) {
  std::vector<bool> named(mesh_count, false);
  for (int32_t i = 0; i < parts.mesh_count; i++) {
    if (parts.meshes[i] < 0 || static_cast<size_t>(parts.meshes[i]) >= mesh_count) {
      throw Fault{ORB_E_BAD_OPTION,
                  "\"template\" names mesh " + std::to_string(parts.meshes[i]) +
                      ", but the document of the first shape has " + std::to_string(mesh_count) +
                      (mesh_count == 1 ? " mesh." : " meshes."),
                  {{"meshes", static_cast<size_t>(std::max(parts.meshes[i], 0)), ""}}};
    }
    named[static_cast<size_t>(parts.meshes[i])] = true;
  }
  const List nodes = array_of(doc, "nodes");
  std::vector<bool> seen(nodes.size(), false);
  for (int32_t i = 0; i < parts.node_count; i++) {
    bool found = false;
    for (size_t n = 0; n < nodes.size(); n++) {
      if (text_of(nodes[n], "name") == parts.nodes[i]) {
        mark_below(nodes, n, &seen, &named);
        found = true;
      }
    }
    if (!found) {
      throw Fault{ORB_E_BAD_OPTION,
                  "\"template\" names the node \"" + std::string(parts.nodes[i]).substr(0, 60) +
                      "\", which the document of the first shape does not have.",
                  {{"nodes", NOWHERE, parts.nodes[i]}}};
    }
  }
  return named;
}

}  // namespace gltf
