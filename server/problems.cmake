# A page for each problem type, made from the sections of docs/troubleshooting.md, so that the `type` of a problem is a
# working link. Appends to the lists of pages.cmake: OUT (a prefix of paths), TROUBLESHOOTING (the file).

# Converts the Markdown that those sections use to HTML: paragraphs, `code`, *words*, links to other sections, and the
# text of links to documents, which the daemon does not serve.
function(orb_html markdown result)
  string(STRIP "${markdown}" text)
  string(REPLACE "&" "&amp;" text "${text}")
  string(REPLACE "<" "&lt;" text "${text}")
  string(REPLACE ">" "&gt;" text "${text}")
  string(REGEX REPLACE "`([^`]+)`" "<code>\\1</code>" text "${text}")
  string(REGEX REPLACE "\\[([^]]+)\\]\\(#([a-z-]+)\\)" "<a href=\"/problems/\\2\">\\1</a>" text "${text}")
  string(REGEX REPLACE "\\[([^]]+)\\]\\([^)]+\\)" "\\1" text "${text}")
  string(REGEX REPLACE "\\*([A-Z][^*]+)\\*" "<em>\\1</em>" text "${text}")
  string(REGEX REPLACE "\n\n+" "</p>\n<p>" text "${text}")
  set(${result} "<p>${text}</p>" PARENT_SCOPE)
endfunction()

file(READ "${TROUBLESHOOTING}" rest)
string(FIND "${rest}" "\n## " at)
while(NOT at EQUAL -1)
  math(EXPR at "${at} + 4")
  string(SUBSTRING "${rest}" ${at} -1 rest)
  string(FIND "${rest}" "\n" line)
  string(SUBSTRING "${rest}" 0 ${line} name)
  string(SUBSTRING "${rest}" ${line} -1 rest)
  # The section ends at the next heading of any level.
  string(FIND "${rest}" "\n#" end)
  string(SUBSTRING "${rest}" 0 ${end} section)
  orb_html("${section}" body)
  file(WRITE "${OUT}.${name}.html"
    "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n"
    "<title>orbmorph: ${name}</title>\n<link rel=\"stylesheet\" href=\"/docs.css\">\n<h1>${name}</h1>\n${body}\n"
    "<p><a href=\"/docs\">API reference</a></p>\n</html>\n")
  list(APPEND paths "/problems/${name}")
  list(APPEND files "${OUT}.${name}.html")
  list(APPEND mimes "text/html")
  string(FIND "${rest}" "\n## " at)
endwhile()
