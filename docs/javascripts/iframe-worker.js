// SPDX-License-Identifier: GPL-3.0-or-later
// Search in pages that are opened from the disk. A browser starts no worker for a file: address, so the
// worker's script runs in a hidden frame of the page instead. mkdocs.yml names this file, because the
// offline plugin of the theme would otherwise load a script of this name from another site.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const element = document.createElement("iframe");
      element.hidden = true;
      document.body.append(element);
      this.frame = element.contentWindow;
      // The script answers through its global postMessage, and adds its own listener.
      this.frame.postMessage = (data) =>
        this.dispatchEvent(new MessageEvent("message", { data }));
      this.ready = new Promise((done) => {
        const script = this.frame.document.createElement("script");
        script.src = url;
        script.onload = done;
        this.frame.document.head.append(script);
      });
    }
    postMessage(data) {
      this.ready.then(() =>
        this.frame.dispatchEvent(new MessageEvent("message", { data })),
      );
    }
  };
}
