//! Watching an image while it converges: with a simulated tev, and the page over HTTP and in the browser.

use crate::browser::Browser;
use crate::checkpoints::Random;
use crate::program::{command, folder_with, read};
use lumiris::imaging::oiio::{ReadLimits, read_image};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const SCENE: &str = "LookAt 0 0 -4 0 0 0 0 1 0\nCamera \"perspective\" \"float fov\" [ 50 ]\n\
                     Film \"rgb\" \"integer xresolution\" [ 50 ] \"integer yresolution\" [ 36 ]\n\
                     Sampler \"independent\" \"integer pixelsamples\" [ 8 ]\nWorldBegin\n\
                     LightSource \"infinite\" \"rgb L\" [ 0.4 0.2 0.1 ]\nShape \"sphere\"\n";

fn folder() -> tempfile::TempDir {
    folder_with(SCENE)
}

fn lumiris(folder: &Path, args: &str) -> Child {
    command(folder, &format!("render scene.pbrt {args}")).stderr(Stdio::piped()).spawn().unwrap()
}

/// Parser of tev's protocol, after its documentation.
struct Message<'a>(&'a [u8]);

impl Message<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (head, rest) = self.0.split_first_chunk().unwrap();
        self.0 = rest;
        *head
    }

    fn byte(&mut self) -> u8 {
        self.bytes::<1>()[0]
    }

    fn u32(&mut self) -> usize {
        u32::from_le_bytes(self.bytes()) as usize
    }

    fn u64(&mut self) -> usize {
        u64::from_le_bytes(self.bytes()) as usize
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).unwrap();
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }
}

/// An image as received by tev.
#[derive(Default)]
struct Shown {
    name: String,
    size: [usize; 2],
    channels: Vec<String>,
    data: Vec<f32>,
    updates: usize,
}

impl Shown {
    fn take(&mut self, bytes: &[u8]) {
        let mut message = Message(bytes);
        match message.byte() {
            4 => {
                // Create an image
                message.byte();
                self.name = message.text();
                self.size = [message.u32(), message.u32()];
                let count = message.u32();
                self.channels = (0..count).map(|_| message.text()).collect();
                self.data = vec![f32::NAN; self.size[0] * self.size[1] * count];
            }
            6 => {
                // Update a tile
                message.byte();
                assert_eq!(message.text(), self.name);
                let count = message.u32();
                let names: Vec<String> = (0..count).map(|_| message.text()).collect();
                assert_eq!(names, self.channels);
                let [x, y, width, height] = [0; 4].map(|_| message.u32());
                let [offsets, strides] = [0; 2].map(|_| (0..count).map(|_| message.u64()).collect::<Vec<_>>());
                let values: Vec<f32> =
                    message.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
                for pixel in 0..width * height {
                    let place = (y + pixel / width) * self.size[0] + x + pixel % width;
                    for c in 0..count {
                        self.data[place * count + c] = values[offsets[c] + pixel * strides[c]];
                    }
                }
                self.updates += 1;
            }
            other => panic!("message {other}"),
        }
    }
}

#[test]
fn tev_has_the_final_image_to_the_bit() {
    // Render, and receive everything
    let folder = folder();
    let tev = TcpListener::bind("127.0.0.1:0").unwrap();
    let args = format!("-q -o a.exr --crop 0.1,1,0,0.9 --tev={}", tev.local_addr().unwrap());
    let child = lumiris(folder.path(), &args);
    let (mut stream, _) = tev.accept().unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    // The last state has the bits of the file
    let (mut shown, mut rest) = (Shown::default(), &bytes[..]);
    while !rest.is_empty() {
        let length = u32::from_le_bytes(rest[..4].try_into().unwrap()) as usize;
        shown.take(&rest[4..length]);
        rest = &rest[length..];
    }
    let image = read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap().image;
    assert_eq!((shown.name.as_str(), shown.size), ("scene.pbrt", [image.width, image.height]));
    assert!(shown.updates >= 6, "{}", shown.updates);
    for (c, name) in shown.channels.iter().enumerate() {
        let of_file = image.channel(name).unwrap();
        for pixel in 0..image.width * image.height {
            let (a, b) =
                (shown.data[pixel * shown.channels.len() + c], image.data[pixel * image.channels.len() + of_file]);
            assert_eq!(a.to_bits(), b.to_bits(), "{name} of pixel {pixel}: {a} {b}");
        }
    }
    for name in ["R", "albedo.G", "normal.Z", "depth.Z", "samples"] {
        assert!(shown.channels.iter().any(|channel| channel == name), "{name} in {:?}", shown.channels);
    }
}

#[test]
fn without_tev_nothing_is_rendered_and_when_it_goes_the_image_is() {
    let folder = folder();
    let tev = TcpListener::bind("127.0.0.1:0").unwrap();
    let args = format!("-q -o a.exr --spp 64 --tev={}", tev.local_addr().unwrap());
    let child = lumiris(folder.path(), &args);
    drop(tev.accept().unwrap());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.path().join("a.exr").exists());

    drop(tev);
    let output = lumiris(folder.path(), &args.replace("a.exr", "b.exr")).wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(3) && text.contains("--tev: there is no tev at 127.0.0.1:"), "{text}");
    assert!(!folder.path().join("b.exr").exists());
}

/// An endless rendering, and the address of its page.
struct Endless {
    child: Child,
    address: String,
}

/// A test that fails leaves no process behind.
impl Drop for Endless {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The address of the page, from the program's first message.
fn address_of(stderr: &mut BufReader<ChildStderr>) -> String {
    let mut lines = stderr.lines().map(Result::unwrap);
    let said = lines.find_map(|l| Some(l.split_once("at http://")?.1.trim_end_matches('/').to_owned()));
    said.unwrap()
}

impl Endless {
    fn start(folder: &Path) -> Endless {
        Endless::of(folder, "--spp 1000000000 --estimator mis")
    }

    fn of(folder: &Path, options: &str) -> Endless {
        let mut child = lumiris(folder, &format!("-o a.exr --view=0 {options}"));
        let address = address_of(&mut BufReader::new(child.stderr.take().unwrap()));
        Endless { child, address }
    }

    fn send(&self, bytes: &[u8]) -> TcpStream {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(bytes).unwrap();
        stream
    }

    /// Status and body of an answer.
    fn ask(&self, method: &str, path: &str, host: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let head = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
        let text = String::from_utf8_lossy(&answer[..head]).into_owned();
        (text.split(' ').nth(1).unwrap().parse().unwrap(), answer[head + 4..].to_vec())
    }

    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        self.ask("GET", path, &self.address)
    }

    /// The state, once all 12 tiles have a sample.
    fn state(&self) -> Value {
        loop {
            let state: Value = serde_json::from_slice(&self.get("/state").1).unwrap();
            if state["version"].as_u64().is_some_and(|version| version >= 12) {
                return state;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    }

    fn stop(mut self) -> Option<i32> {
        assert!(Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

#[test]
fn there_are_pixels_to_see_before_pilots_are_done() {
    let folder = folder();
    let view = Endless::of(folder.path(), "--noise 0.0000001 --spp 1000000000");
    // All tiles arrive while the pilot for the noise target runs
    view.state();
    assert_eq!(view.stop(), Some(130));
    assert!(!folder.path().join("a.exr").exists(), "the first sample has not been rendered");
}

#[test]
fn the_server_knows_the_page_its_data_and_nothing_else() {
    let folder = folder();
    let view = Endless::start(folder.path());
    let state = view.state();
    assert_eq!((&state["name"], &state["width"], &state["height"]), (&"scene.pbrt".into(), &50.into(), &36.into()));
    assert_eq!(state["layers"][0], serde_json::json!({ "name": "beauty", "channels": 3 }));
    assert_eq!(state["finished"], false);

    // Tiles: all at first, then those that changed
    let number = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let tiles = format!("/tiles?image={}&layer=0&since=0", state["image"]);
    let (status, bytes) = view.get(&tiles);
    assert_eq!(status, 200);
    let (mut places, mut at) = (Vec::new(), 8);
    while at < bytes.len() {
        let place = [0, 4, 8, 12].map(|offset| number(&bytes, at + offset));
        at += 16;
        if place[..2] == [0, 0] {
            let corner = [0, 4, 8].map(|offset| f32::from_bits(number(&bytes, at + offset)));
            assert_eq!(corner, [0.4, 0.2, 0.1], "the sky");
        }
        at += 12 * (place[2] * place[3]) as usize;
        places.push(place);
    }
    places.sort_unstable();
    assert_eq!((places.len(), places[0], places[11]), (12, [0, 0, 16, 16], [48, 32, 2, 4]));
    for wrong in [
        "/tiles",
        "/tiles?image=7&layer=0&since=0",
        "/tiles?image=0&layer=99&since=0",
        "/tiles?image=0&layer=-1&since=0",
    ] {
        assert!([400, 404].contains(&view.get(wrong).0), "{wrong}");
    }

    for path in
        ["/etc/passwd", "/../../../../etc/passwd", "//etc/passwd", "/scene.pbrt", "/%2e%2e/scene.pbrt", "/a.exr"]
    {
        let (status, body) = view.get(path);
        assert!(status == 404 || status == 400, "{path}: {status}");
        assert!(body.len() < 100, "{path}: {}", String::from_utf8_lossy(&body));
    }
    assert_eq!(view.ask("POST", "/state", &view.address).0, 405);
    // DNS rebinding: a page of another site uses its own name for this address
    let port = view.address.rsplit_once(':').unwrap().1;
    assert_eq!(view.ask("GET", "/state", &format!("evil.example:{port}")).0, 403);
    assert_eq!(view.ask("GET", "/state", &format!("localhost:{port}")).0, 200);
    let (_, page) = view.get("/");
    let page = String::from_utf8(page).unwrap();
    assert!(!page.contains("http:") && !page.contains("https:") && !page.contains("/*s"), "{page}");
    assert_eq!(view.stop(), Some(130));
    assert!(folder.path().join("a.exr").exists());
}

/// The status of an answer; `None` if the connection ends without one.
fn status(mut stream: TcpStream) -> Option<u16> {
    let mut answer = Vec::new();
    // A client that has not sent everything may lose the connection before it reads the answer
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).split(' ').nth(1)?.parse().ok()
}

#[test]
fn requests_are_short_and_have_no_body_whatever_they_announce() {
    let folder = folder();
    let view = Endless::start(folder.path());
    let host = format!("Host: {}\r\n", view.address);
    for body in ["Content-Length: 99999999999\r\n", "Content-Length: 5\r\n", "Transfer-Encoding: chunked\r\n"] {
        let stream = view.send(format!("GET / HTTP/1.1\r\n{host}{body}\r\n").as_bytes());
        assert!([Some(400), Some(413)].contains(&status(stream)), "{body}");
    }
    // Endless lines and heads are cut off after 16 kB, long before a megabyte has been sent
    for head in ["GET /".to_owned(), format!("GET / HTTP/1.1\r\n{host}X: ")] {
        let mut stream = view.send(head.as_bytes());
        let sent = (0..256).take_while(|_| stream.write_all(&[b'a'; 4096]).is_ok()).count();
        assert!(sent < 256 || [None, Some(414), Some(431)].contains(&status(stream)), "{head}");
    }
    let filler = |bytes: usize| format!("GET / HTTP/1.1\r\n{host}X: {}\r\n\r\n", "a".repeat(bytes));
    assert_eq!(status(view.send(filler(15_000).as_bytes())), Some(200));
    assert_ne!(status(view.send(filler(17_000).as_bytes())), Some(200));

    // Connections that are half open, or that do not read, do not block others
    let state = view.state();
    let tiles = format!("GET /tiles?image={}&layer=0&since=0 HTTP/1.1\r\n{host}\r\n", state["image"]);
    let held: Vec<TcpStream> =
        (0..300).map(|i| view.send(if i % 2 == 0 { &b"GET / HT"[..] } else { tiles.as_bytes() })).collect();
    let start = Instant::now();
    assert_eq!(view.get("/state").0, 200);
    assert!(start.elapsed() < Duration::from_secs(8), "{:?}", start.elapsed());
    // The oldest are closed
    assert_eq!(status(held.into_iter().next().unwrap()), None);
    assert_eq!(view.stop(), Some(130));
}

/// A request with random changes: bytes replaced, removed or repeated, or pieces of other requests inserted.
fn malformed(random: &mut Random, address: &str) -> Vec<u8> {
    const LINES: [&str; 6] = [
        "GET / HTTP/1.1\r\n",
        "GET /state HTTP/1.1\r\n",
        "GET /tiles?image=0&layer=0&since=0 HTTP/1.0\r\n",
        "GET http://evil.example/../%2e%2e/etc/passwd HTTP/1.1\r\n",
        "POST /state HTTP/1.1\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n",
    ];
    const PIECES: [&[u8]; 12] = [
        b"Content-Length: 99999999999\r\n",
        b"Content-Length: 18446744073709551616\r\n",
        b"Content-Length: -1\r\n",
        b"Transfer-Encoding: chunked\r\n",
        b"Expect: 100-continue\r\n",
        b"Connection: Upgrade\r\nUpgrade: websocket\r\n",
        b"Host: evil.example\r\n",
        b"fffffffffffffffff\r\n",
        b"\r\n\r\n",
        b"\n \t",
        b"\0\xff\xfe",
        b"&since=99999999999999999999",
    ];

    // Change a valid request up to four times
    let mut below = |n: usize| random.below(n as u64) as usize;
    let mut bytes = format!("{}Host: {address}\r\n\r\n", LINES[below(LINES.len())]).into_bytes();
    for _ in 0..=below(4) {
        let at = below(bytes.len() + 1);
        match below(5) {
            0 => bytes.truncate(at),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = below(256) as u8),
            2 => drop(bytes.drain(at..bytes.len().min(at + 1 + below(8)))),
            3 => drop(bytes.splice(at..at, PIECES[below(PIECES.len())].iter().copied())),
            _ => drop(bytes.splice(at..at, vec![below(256) as u8; below(3000)])),
        }
    }
    bytes
}

/// Sends a request, and reads its answer to the end.
fn exchange(address: &str, request: &[u8]) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(Duration::from_secs(20)))?;
    // The server may end the connection at any time
    let _ = stream.write_all(request).and_then(|()| stream.shutdown(Shutdown::Write));
    let _ = stream.read_to_end(&mut Vec::new());
    Ok(())
}

#[test]
fn ten_thousand_malformed_requests_leave_the_image_as_it_is() {
    const REQUESTS: u64 = 10_000;
    let folder = folder();
    let args = "--spp 800 --estimator mis --threads 1";
    let alone = lumiris(folder.path(), &format!("{args} -q -o a.exr")).wait_with_output().unwrap();
    assert!(alone.status.success());

    // The page exists while the program waits for the scene, and while it renders
    let mut watched = command(folder.path(), &format!("render - {args} -o b.exr --view=0"));
    let mut child = watched.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let address = address_of(&mut stderr);
    let (next, scene) = (AtomicU64::new(0), Mutex::new(child.stdin.take()));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= REQUESTS {
                        break;
                    }
                    if index == REQUESTS / 4 {
                        scene.lock().unwrap().take().unwrap().write_all(SCENE.as_bytes()).unwrap();
                    }
                    let request = malformed(&mut Random(index), &address);
                    let reached = exchange(&address, &request);
                    // The page is gone after the rendering
                    assert!(index > REQUESTS / 4 || reached.is_ok(), "request {index}: {reached:?}");
                }
            });
        }
    });
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    assert!(child.wait().unwrap().success(), "{said}");
    let [a, b] = ["a.exr", "b.exr"].map(|name| read(folder.path(), name).image);
    assert_eq!(a.channels, b.channels);
    assert!(a.data.iter().zip(&b.data).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn a_tev_that_reads_slowly_holds_nothing_up() {
    let folder = folder();
    let tev = TcpListener::bind("127.0.0.1:0").unwrap();
    // 21 MB, which would take a minute
    let args = format!("-q -o a.exr --resolution 800x600 --spp 1 --estimator mis --tev={}", tev.local_addr().unwrap());
    let mut child = lumiris(folder.path(), &args);
    let (mut stream, _) = tev.accept().unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() && start.elapsed() < Duration::from_secs(30) {
        // An error is the end of the connection
        let _ = stream.read(&mut [0; 1 << 15]);
        // It also sends garbage
        let _ = stream.write_all(&[7; 4096]);
        std::thread::sleep(Duration::from_millis(100));
    }
    let status = child.try_wait().unwrap();
    let _ = child.kill();
    assert!(status.is_some_and(|status| status.success()), "{status:?} after {:?}", start.elapsed());
    assert!(folder.path().join("a.exr").exists());
}

#[test]
fn the_page_is_for_this_machine_unless_the_user_insists() {
    let folder = folder();
    for wrong in ["--view=0.0.0.0:0", "--view=192.168.1.7", "--view=[::]:0", "--view=nowhere", "--view-insecure"] {
        let output = lumiris(folder.path(), &format!("-o a.exr {wrong}")).wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let output = lumiris(folder.path(), "-q -o a.exr --view=0.0.0.0:0 --view-insecure").wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_page_shows_the_image_while_it_converges() {
    let folder = folder();
    let view = Endless::start(folder.path());
    let browser = Browser::start([900, 640]);
    browser.open_url(
        &format!("http://{}/", view.address),
        "typeof state !== 'undefined' && state !== null && version !== '0'",
    );
    browser.wait_for("/%.*elapsed.*left/.test(document.getElementById('status').textContent)");
    assert_eq!(browser.run("document.title"), "scene.pbrt");
    assert_eq!(browser.run("[picture.width, picture.height]"), serde_json::json!([50, 36]));
    // The corner shows the sky
    let corner = "[...context.getImageData(0, 0, 1, 1).data]";
    let srgb = |v: f32| (lumiris::imaging::color::linear_to_srgb(v) * 255.0).round();
    let near = |found: Value, expected: [f32; 3]| {
        let found: Vec<f32> = found.as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect();
        assert!(expected.iter().zip(&found).all(|(e, f)| (srgb(*e) - f).abs() <= 1.0), "{found:?} {expected:?}");
    };
    browser.wait_for("context.getImageData(0, 0, 1, 1).data[0] > 0");
    near(browser.run(corner), [0.4, 0.2, 0.1]);
    browser.run("exposure.value = 1; exposure.oninput()");
    near(browser.run(corner), [0.8, 0.4, 0.2]);

    // The image changes
    browser.run("window.before = version");
    browser.wait_for("version !== window.before");

    // The wheel zooms in at the pointer, and shows the pixel's values
    let before = browser.run("view.scale").as_f64().unwrap();
    browser.point([450.0, 320.0]);
    browser.wheel([450.0, 320.0], -240.0);
    browser.wait_for(&format!("view.scale > {}", before * 1.5));
    browser.point([451.0, 321.0]);
    browser.wait_for("/^\\d+, \\d+: /.test(document.getElementById('value').textContent)");

    browser.run("layerChoice.value = 2; layerChoice.onchange()");
    browser.wait_for("state.layers[layerChoice.value].name === 'normal' && pixels.some((v) => v !== 0)");
    browser.run("document.getElementById('fit').click()");
    browser.settle();
    if let Ok(path) = std::env::var("LUMIRIS_SCREENSHOT") {
        browser.screenshot(Path::new(&path));
    }
    assert_eq!(view.stop(), Some(130));
    browser.wait_for("/finished/.test(document.getElementById('status').textContent)");
    let complaints = browser.complaints.borrow();
    // The end of the program, and a warning because this test reads pixels
    let expected = ["ERR_CONNECTION", "willReadFrequently"];
    assert!(complaints.iter().all(|c| expected.iter().any(|e| c.contains(e))), "{complaints:?}");
}
