"""The HTML document that viser serves, with what its own interface has no way for: a title, names, and keys."""

from __future__ import annotations

import gzip
from html import escape

from websockets.http11 import Response

# Sliders, and the numbers beside them, have no name that a screen reader could tell, the headings of folders are no
# buttons and cannot be reached by keys, and arrows move the camera even while a slider has the focus. What viser draws
# anew is named anew. The texts of status and clicked point are told when they change.
_SCRIPT = """
const name = element => {
  for (const label of element.querySelectorAll("label[for]")) {
    const row = label.closest("p")?.parentElement?.parentElement;
    for (const part of row?.querySelectorAll("[role=slider], input:not([type=hidden])") ?? []) {
      if (part.id !== label.htmlFor && !part.ariaLabel) part.ariaLabel = label.textContent;
    }
  }
  for (const button of element.querySelectorAll("button:not([aria-label])")) {
    if (button.textContent) continue;
    button.ariaLabel = button.closest(".mantine-Notification-root") ? "Close" : "Connection and display";
  }
  for (const text of element.querySelectorAll(".edgel-status, .edgel-point")) {
    text.parentElement.setAttribute("role", "status");
  }
  for (const canvas of element.querySelectorAll("canvas:not([aria-label])")) {
    canvas.setAttribute("role", "img");
    canvas.ariaLabel = "The clouds and their edges";
  }
  for (const icon of element.querySelectorAll(".tabler-icon-chevron-up, .tabler-icon-chevron-down")) {
    const heading = icon.parentElement;
    if (heading.tagName !== "DIV" || !heading.textContent) continue;
    heading.setAttribute("role", "button");
    heading.tabIndex = 0;
    heading.ariaExpanded = icon.classList.contains("tabler-icon-chevron-up");
  }
};
new MutationObserver(() => name(document.body)).observe(document.body, {childList: true, subtree: true});
document.body.addEventListener("keydown", event => {
  if (event.target.closest("[role=slider]")) event.stopPropagation();
  if (event.target.matches("div[role=button]") && (event.key === "Enter" || event.key === " ")) {
    event.preventDefault();
    event.target.click();
  }
});
"""


def dress(answer: Response, title: str) -> Response:
    """Give the page its title, and the script above; other answers stay as they are."""
    if not answer.headers.get("Content-Type", "").startswith("text/html"):
        return answer
    packed = answer.headers.get("Content-Encoding") == "gzip"
    text = (gzip.decompress(answer.body) if packed else answer.body).decode()
    text = text.replace("<title>Viser</title>", f"<title>{escape(title)}</title>", 1)
    head, body, rest = text.rpartition("</body>")
    text = f"{head}<script>{_SCRIPT}</script>{body}{rest}"
    answer.body = gzip.compress(text.encode()) if packed else text.encode()
    del answer.headers["Content-Length"]
    answer.headers["Content-Length"] = str(len(answer.body))
    return answer
