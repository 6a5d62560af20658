/* Wide tables scroll in a frame of their own, which the keyboard must reach. */
new MutationObserver(() => {
  for (const frame of document.querySelectorAll(".md-typeset__scrollwrap")) frame.tabIndex = 0;
}).observe(document.documentElement, { childList: true, subtree: true });
