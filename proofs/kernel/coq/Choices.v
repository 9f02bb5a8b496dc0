(** Plans with choices and their correct executions [PIKE, Definitions 2.1 to 2.8], formally what `proofs/checker/choices.py`
    says. Choices, their values, events, atoms and activities are numbered. *)

Require Import Reals QArith Qreals List.
Require Import Spec.
Import ListNotations.
Open Scope R_scope.

(** Values of some choices. *)
Definition label := list (nat * nat).

(** How long after one event another one happens, if choices have some values: durations of activities as well. *)
Record span := { span_from : nat; span_until : nat; shortest : option Q; longest : option Q; span_if : label }.

(** An atom has to be true, or false, just before an event and from then on until just before another one, if choices have
    some values: as a condition of an activity, or as a part of the goal. *)
Record demand :=
  { about : nat; wanted : bool; needed_from : nat; needed_until : nat; needed_if : label; needed_by : option nat }.

(** An atom becomes true, or false, at an event, if choices have some values: by an activity, or as it is at first. *)
Record gain := { of_atom : nat; given : bool; gained_at : nat; gained_if : label; gained_by : option nat }.

Record team_plan := {
  sizes : list nat;   (* how many values each choice has *)
  spans : list span;
  demands : list demand;
  gains : list gain
}.

Section Execution.
Variable N : team_plan.
Variable epsilon : Q.
Variable x : nat -> nat.   (* the value of each choice *)
Variable t : nat -> R.     (* when each event happens, of those that do *)

Definition chosen (l : label) : Prop := forall c v, In (c, v) l -> x c = v.

Definition precedes (a b : nat) : Prop := t a + Q2R epsilon <= t b.

Definition in_bounds (s : span) : Prop :=
  match shortest s with Some q => Q2R q <= t (span_until s) - t (span_from s) | None => True end /\
  match longest s with Some q => t (span_until s) - t (span_from s) <= Q2R q | None => True end.

(** What an activity does at its start is in time for its own condition over all. *)
Definition just_in_time (d : demand) (g : gain) : Prop :=
  gained_by g = needed_by d /\ gained_at g = needed_from d /\ needed_from d <> needed_until d.

(** What an activity does where a condition of its own ends comes after that. *)
Definition threatens (d : demand) (g : gain) : Prop :=
  of_atom g = about d /\ given g <> wanted d /\ chosen (gained_if g) /\
  ~ (gained_by g = needed_by d /\ gained_at g = needed_until d).

(** A producer is in time, and no threat is between it and the end of what is demanded. *)
Definition produces (d : demand) (g : gain) : Prop :=
  of_atom g = about d /\ given g = wanted d /\ chosen (gained_if g) /\
  (just_in_time d g \/ precedes (gained_at g) (needed_from d)) /\
  forall h, In h (gains N) -> threatens d h -> precedes (gained_at h) (gained_at g) \/ precedes (needed_until d) (gained_at h).

Definition correct : Prop :=
  (forall c n, nth_error (sizes N) c = Some n -> (x c < n)%nat) /\
  (forall s, In s (spans N) -> chosen (span_if s) -> in_bounds s) /\
  (forall d, In d (demands N) -> chosen (needed_if d) -> exists g, In g (gains N) /\ produces d g).
End Execution.

(** There is no correct execution with some values of choices. *)
Definition no_execution (N : team_plan) (epsilon : Q) (assumed : label) : Prop :=
  forall x t, chosen x assumed -> ~ correct N epsilon x t.
