// Tables and formulas that scroll can be reached by keyboard.
function reach() {
  for (const part of document.querySelectorAll("article table, article p, article math")) {
    if (part.scrollWidth > part.clientWidth && getComputedStyle(part).overflowX === "auto") part.tabIndex = 0;
    else part.removeAttribute("tabindex");
  }
}
addEventListener("load", reach);
addEventListener("resize", reach);
