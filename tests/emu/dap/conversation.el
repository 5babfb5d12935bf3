;;; conversation.el --- a debugging session in Emacs, by dap-mode's own commands -*- lexical-binding: t -*-

;; Run by test_emacs.py: emacs --batch -l conversation.el, with EMU_PYTHON, EMU_PROGRAM, EMU_SOURCE and EMU_LINE in the
;; environment. Prints what Emacs shows at each stop, one line each.

(require 'package)
(package-initialize)
(require 'dap-mode)
(require 'dap-ui)

(defvar halts 0 "How often the robot has halted and Emacs has gone to the line.")
(add-hook 'dap-stack-frame-changed-hook (lambda (_session) (setq halts (1+ halts))))

(defun say (form &rest values)
  (princ (concat (apply #'format form values) "\n")))

(defun halted (act)
  "Do ACT, wait for the halt it leads to, and tell the line that Emacs shows then."
  (let ((before halts) (end (+ (float-time) 100)))
    (funcall act)
    (while (= halts before)
      (when (> (float-time) end) (error "The adapter has not halted"))
      (accept-process-output nil 0.05))
    (let ((frame (dap--debug-session-active-frame (dap--cur-session))))
      (say "%s at %s:%d: %s" (gethash "name" frame) (file-name-nondirectory buffer-file-name) (line-number-at-pos)
           (string-trim (thing-at-point 'line t))))))

(defun thread ()
  (dap--debug-session-thread-id (dap--cur-session)))

(defun locals ()
  "Names and values of the selected frame's locals."
  (let* ((session (dap--cur-session))
         (frame (gethash "id" (dap--debug-session-active-frame session)))
         (scopes (gethash "scopes" (dap-request session "scopes" :frameId frame)))
         (reference (gethash "variablesReference" (elt scopes 0)))
         (rows (gethash "variables" (dap-request session "variables" :variablesReference reference))))
    (say "%s: %s" (gethash "name" (elt scopes 0))
         (mapconcat (lambda (row) (format "%s=%s" (gethash "name" row) (gethash "value" row))) rows " "))))

(find-file (getenv "EMU_SOURCE"))
(goto-char (point-min))
(forward-line (1- (string-to-number (getenv "EMU_LINE"))))
(dap-breakpoint-add)
(halted (lambda ()
          (dap-start-debugging-noexpand
           (list :type "openswarm" :request "launch" :name "robot" :program (getenv "EMU_PROGRAM")
                 :dap-server-path (list (getenv "EMU_PYTHON") "-m" "emu" "debug")))))
(locals)
(halted (lambda () (dap-next (dap--cur-session))))
(halted (lambda () (dap-request (dap--cur-session) "stepBack" :threadId (thread))))
(halted (lambda () (dap-continue (dap--cur-session) (thread))))
(locals)
(halted (lambda () (dap-step-out (dap--cur-session))))
(halted (lambda () (dap-request (dap--cur-session) "reverseContinue" :threadId (thread))))
(let ((process (dap--debug-session-proc (dap--cur-session))))
  (dap-disconnect (dap--cur-session))
  (while (process-live-p process) (accept-process-output nil 0.05))
  (say "the adapter has ended: %d" (process-exit-status process)))
;;; conversation.el ends here
