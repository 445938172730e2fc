//! Headless Chromium, driven over the DevTools protocol: real mouse and key events, scripts, pixels.
//!
//! The protocol uses two pipes; messages end with a zero byte. The browser is `chromium` in the path, unless the
//! variable CHROMIUM names another.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::cell::{Cell, RefCell};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Timeout of an answer. Test machines can be slow and busy.
const PATIENCE: Duration = Duration::from_secs(180);

/// A browser with one open page.
pub(crate) struct Browser {
    process: Child,
    input: ChildStdin,
    messages: Receiver<Value>,
    next: Cell<u64>,
    session: String,
    /// Errors and warnings of the console, and uncaught exceptions.
    pub complaints: RefCell<Vec<String>>,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts a browser with a window of this size (CSS pixels).
    pub(crate) fn start(size: [u32; 2]) -> Browser {
        let program = std::env::var("CHROMIUM").unwrap_or_else(|_| "chromium".to_owned());
        let profile = tempfile::tempdir().unwrap();
        // The protocol uses the descriptors 3 (commands) and 4 (answers), which the shell opens
        let script = "exec \"$@\" 3<&0 4>&1 0</dev/null 1>/dev/null 2>/dev/null";
        let mut process = Command::new("sh")
            .args(["-c", script, "sh", &program])
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-extensions"])
            .args(["--hide-scrollbars", "--force-device-scale-factor=1", "--remote-debugging-pipe"])
            .arg(format!("--window-size={},{}", size[0], size[1]))
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = process.stdin.take().unwrap();
        let output = BufReader::new(process.stdout.take().unwrap());
        let (send, messages) = channel();
        std::thread::spawn(move || {
            for message in output.split(0) {
                let Ok(value) = serde_json::from_slice(&message.unwrap_or_default()) else { return };
                if send.send(value).is_err() {
                    return;
                }
            }
        });
        let mut browser = Browser {
            process,
            input,
            messages,
            next: Cell::new(1),
            session: String::new(),
            complaints: RefCell::default(),
            _profile: profile,
        };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let session = browser.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        browser.session = session["sessionId"].as_str().unwrap().to_owned();
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            browser.call(domain, json!({}));
        }
        let metrics = json!({ "width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": false });
        browser.call("Emulation.setDeviceMetricsOverride", metrics);
        browser
    }

    /// Sends a command and waits for its answer.
    pub(crate) fn call(&self, method: &str, params: Value) -> Value {
        // Send
        let id = self.next.replace(self.next.get() + 1);
        let mut message = json!({ "id": id, "method": method, "params": params });
        if !self.session.is_empty() {
            message["sessionId"] = json!(self.session);
        }
        let mut bytes = message.to_string().into_bytes();
        bytes.push(0);
        let hint = "is Chromium installed? CHROMIUM may name it";
        (&self.input).write_all(&bytes).expect(hint);

        // Wait; other messages are events
        let end = Instant::now() + PATIENCE;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let message = self.messages.recv_timeout(left).unwrap_or_else(|e| panic!("{method}: {e}; {hint}"));
            if message["id"] == id {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].clone();
            }
            self.listen(&message);
        }
    }

    /// Stores errors and warnings of the page.
    fn listen(&self, message: &Value) {
        let params = &message["params"];
        let complaint = match message["method"].as_str() {
            Some("Runtime.exceptionThrown") => Some(params["exceptionDetails"].to_string()),
            Some("Runtime.consoleAPICalled") if ["error", "warning", "assert"].iter().any(|t| params["type"] == *t) => {
                Some(params["args"].to_string())
            }
            Some("Log.entryAdded") if params["entry"]["level"] != "verbose" && params["entry"]["level"] != "info" => {
                Some(params["entry"].to_string())
            }
            _ => None,
        };
        self.complaints.borrow_mut().extend(complaint);
    }

    /// Opens a file and waits until the script `ready` is true.
    pub(crate) fn open(&self, path: &Path, ready: &str) {
        self.open_url(&format!("file://{}", path.display()), ready);
    }

    /// Opens a page and waits until the script `ready` is true.
    pub(crate) fn open_url(&self, url: &str, ready: &str) {
        let answer = self.call("Page.navigate", json!({ "url": url }));
        assert!(answer["errorText"].is_null(), "{answer}");
        self.wait_for(ready);
    }

    /// Waits until a script is true.
    pub(crate) fn wait_for(&self, condition: &str) {
        let end = Instant::now() + PATIENCE;
        while self.run(condition) != json!(true) {
            assert!(Instant::now() < end, "{condition} does not come true; {:?}", self.complaints.borrow());
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// The value of a script.
    pub(crate) fn run(&self, script: &str) -> Value {
        let params = json!({ "expression": script, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{script}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Drags with the left button along points of the window.
    pub(crate) fn drag(&self, points: &[[f64; 2]]) {
        let event = |kind: &str, [x, y]: [f64; 2], buttons: u32| {
            let params = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", params);
        };
        event("mousePressed", points[0], 1);
        points[1..].iter().for_each(|&p| event("mouseMoved", p, 1));
        event("mouseReleased", points[points.len() - 1], 0);
    }

    /// Moves the mouse.
    pub(crate) fn point(&self, [x, y]: [f64; 2]) {
        self.call("Input.dispatchMouseEvent", json!({ "type": "mouseMoved", "x": x, "y": y }));
    }

    /// Rotates the wheel; negative is away from the user.
    pub(crate) fn wheel(&self, [x, y]: [f64; 2], delta: f64) {
        let params = json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": delta });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Presses and releases a key that types `text`.
    pub(crate) fn key(&self, key: &str, code: &str, shift: bool) {
        for kind in ["keyDown", "keyUp"] {
            let params = json!({ "type": kind, "key": key, "code": code, "modifiers": if shift { 8 } else { 0 } });
            self.call("Input.dispatchKeyEvent", params);
        }
    }

    /// Waits until the page has been drawn twice.
    pub(crate) fn settle(&self) {
        self.run("new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(() => f(true))))");
    }

    /// An image of the window, as a PNG file.
    pub(crate) fn screenshot(&self, path: &Path) {
        let answer = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        std::fs::write(path, STANDARD.decode(answer["data"].as_str().unwrap()).unwrap()).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // `Browser.close` also ends child processes. A browser that does not react is killed. Failures do not matter
        // here
        let close = b"{\"id\":0,\"method\":\"Browser.close\"}\0";
        let _ = (&self.input).write_all(close);
        for _ in 0..200 {
            if matches!(self.process.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(25));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
