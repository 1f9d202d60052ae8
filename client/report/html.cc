#include "client/report/html.h"

#include <fmt/format.h>

#include <utility>

namespace selfcal::client {
namespace {

constexpr std::string_view kStyle = R"(
:root { color-scheme: light dark; --ink: #1d2126; --paper: #fbfbfa;
  --faint: #5c6570; --line: #dde1e6; --accent: #2f6fdb; --band: #2f6fdb22;
  --good: #17703f; --weak: #8a5a00; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ed;
  --paper: #15181c; --faint: #a0a9b4; --line: #343b44; --band: #2f6fdb33;
  --good: #6fd39b; --weak: #f0c069; --bad: #ff8a80; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink);
  background: var(--paper); margin: 0; padding: 1.5rem clamp(12px, 2.5vw, 48px);
  overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
p, li { max-width: 100ch; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums;
  display: block; overflow-x: auto; overflow-wrap: normal; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0;
  border-bottom: 1px solid var(--line); vertical-align: middle; }
td:first-child, td:last-child { min-width: 16ch; max-width: 64ch;
  overflow-wrap: anywhere; }
.number { text-align: right; } .faint { color: var(--faint); }
.charts { display: grid; gap: 1rem 1.5rem;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, 480px), 1fr)); }
.verdict { border-left: .4rem solid; padding: .2rem 1rem; font-size: 1.1rem; }
.good { border-color: var(--good); } .weak { border-color: var(--weak); }
.bad { border-color: var(--bad); } summary { cursor: pointer; }
svg { max-width: 100%; } .charts svg { width: 100%; height: auto;
  max-width: 750px; }
svg text { fill: var(--faint); font-size: 12px; }
svg .axis, svg .grid { stroke: var(--line); fill: none; }
svg .tick { stroke: var(--faint); fill: none; }
svg .mark { fill: var(--accent); } svg .hollow { fill: none;
  stroke: var(--faint); } svg .trace { stroke: var(--accent); fill: none;
  stroke-width: 2; } svg .band { fill: var(--band); stroke: none; }
)";

}  // namespace

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default: {
        const auto code = static_cast<unsigned char>(c);
        escaped += code < 0x20 && c != '\n' && c != '\t' ? '?' : c;
      }
    }
  }
  return escaped;
}

HtmlTable::HtmlTable(std::vector<HtmlColumn> columns)
    : columns_(std::move(columns)) {}

void HtmlTable::Add(const std::vector<std::string>& cells) {
  rows_ += "<tr>";
  for (std::size_t k = 0; k < cells.size(); ++k) {
    rows_ += fmt::format("<td{}>{}</td>",
                         columns_[k].number ? " class=\"number\"" : "",
                         cells[k]);
  }
  rows_ += "</tr>\n";
}

std::string HtmlTable::Html() const {
  std::string head;
  for (const HtmlColumn& column : columns_) {
    head += fmt::format("<th scope=\"col\"{}>{}</th>",
                        column.number ? " class=\"number\"" : "",
                        Escaped(column.title));
  }
  return fmt::format(
      "<table><thead><tr>{}</tr></thead>\n<tbody>{}</tbody></table>\n",
      head,
      rows_);
}

std::string Section(std::string_view id,
                    std::string_view title,
                    std::string_view body) {
  return fmt::format(
      "<section aria-labelledby=\"{0}\"><h2 id=\"{0}\">{1}</h2>\n{2}"
      "</section>\n",
      id,
      Escaped(title),
      body);
}

std::string Page(std::string_view title, std::string_view body) {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src "
      "'none'; style-src 'unsafe-inline'\">\n"
      "<title>{0}</title><style>{1}</style></head>\n<body><main>\n"
      "<h1>{0}</h1>\n{2}</main></body></html>\n",
      Escaped(title),
      kStyle,
      body);
}

}  // namespace selfcal::client
